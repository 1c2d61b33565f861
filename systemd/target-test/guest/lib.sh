# What both tests of the guest share. Results go line by line to /mnt/host/out/checks.txt:
# PASS or FAIL, seconds since boot, what was checked. The last line of a test that ran is END.
set -u
out=/mnt/host/out
config=/etc/fpeg-hil/engine.toml
cd /root

now() { cut -d' ' -f1 /proc/uptime; }
told() { printf '%s\t%s\t%s\n' "$1" "$(now)" "$2" >> $out/checks.txt; }
ok() { # NAME COMMAND...
    local name=$1; shift
    if "$@"; then told PASS "$name"; else told FAIL "$name"; fi
}
within() { # SECONDS COMMAND...: true as soon as the command is
    local end=$((SECONDS + $1)); shift
    until "$@"; do
        [ $SECONDS -lt $end ] || return 1
        sleep 0.2
    done
}
property() { # on a busy host the manager may take longer to answer than systemctl waits
    local value
    until value=$(systemctl show -P "$2" "fpeg-$1.service" 2>/dev/null); do sleep 1; done
    echo "$value"
}
is() { [ "$(property "$1" "$2")" = "$3" ]; }
active() { is plant ActiveState active && is controller ActiveState active; }
status_has() { property "$1" StatusText | grep -q "$2"; }
journal_has() { journalctl -b -q --no-pager -u "fpeg-$1.service" | grep -q "$2"; }
pid_changed() { [ "$(property "$1" MainPID)" != "$2" ] && [ "$(property "$1" MainPID)" != 0 ]; }
restarted() { pid_changed "$1" "$2" && is "$1" ActiveState active; }
recorders() { systemctl list-units --no-legend --plain 'fpeg-recorder@*' | grep -c running; }
has_recorders() { [ "$(recorders)" = "$1" ]; }
python() { PYTHONPATH=/opt/fpeg-hil/lib:/opt/fpeg-hil/packages python3 -P "$@"; }
finish() {
    journalctl -b -q -o short-monotonic --no-pager > $out/journal.txt
    told END end
    sync
}
