/* The panel: what a running engine does, and what is asked of it.

   Samples come as frames of doubles (bench/panel/viewers.py), words as JSON. Tracks keep the last
   minute of what is shown; scopes are plots of plot.js over them, all in one group. */
"use strict";
const Panel = (() => {
  const $ = id => document.getElementById(id);
  const KEPT_S = 62, socketAddress = () => `ws://${location.host}/socket${location.search}`;
  const tracks = new Map(), scopes = [], group = Plots.group("live"), pending = new Map();
  const state = { paused: false, span: 5, now: 0, steering: false, trigger: null, held: null,
    info: null, values: {}, edits: new Map(), mode: null, modes: [], asked: 0, frames: 0, offset: null };
  let socket = null;

  /* ---- samples ---- */

  class Track {
    constructor(members) { this.members = members; this.capacity = 4096; this.n = 0; this.columns = this.room(4096); }
    room(size) { return Array.from({ length: 1 + this.members.length }, () => new Float64Array(size)); }
    /* Take in what is later than all there is: a window may have brought some of it already. */
    append(columns, n) {
      const seen = this.n ? Plots.place(columns[0], this.columns[0][this.n - 1] + 1e-9) : 0;
      if (seen) { columns = columns.map(column => column.subarray(seen)); n -= seen; }
      if (n <= 0) return;
      if (this.n + n > this.capacity) this.make(n);
      columns.forEach((column, i) => this.columns[i].set(column, this.n));
      this.n += n;
    }
    /* Forget what is older than a minute; grow where that is not enough. */
    make(n) {
      const times = this.columns[0].subarray(0, this.n), last = this.n ? times[this.n - 1] : 0;
      const from = Plots.place(times, last - KEPT_S);
      while (this.n - from + n > 0.75 * this.capacity) this.capacity *= 2;
      const room = this.room(this.capacity);
      room.forEach((column, i) => column.set(this.columns[i].subarray(from, this.n)));
      this.columns = room; this.n -= from;
    }
    replace(columns, n) { this.n = 0; this.capacity = Math.max(this.capacity, 2 * n); this.columns = this.room(this.capacity); this.append(columns, n); }
    x() { return this.columns[0].subarray(0, this.n); }
    y(name) { const i = this.members.indexOf(name); return i < 0 ? new Float64Array(0) : this.columns[i + 1].subarray(0, this.n); }
  }

  function unpacked(buffer) {
    const size = new DataView(buffer).getUint32(0, true);
    const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, size)));
    let at = 4 + size;
    head.groups = head.groups.map(([names, n]) => {
      const columns = [];
      for (let i = 0; i <= names.length; i++, at += 8 * n) columns.push(new Float64Array(buffer, at, n));
      return { names, n, columns };
    });
    return head;
  }

  function take(buffer) {
    const head = unpacked(buffer);
    for (const { names, n, columns } of head.groups) {
      if (!n) continue;
      const key = names.join(" ");
      let track = tracks.get(key);
      if (!track) {
        /* Samples under way when other signals were chosen have made a track that nothing follows. */
        for (const [old, t] of tracks) if (t.members.some(name => names.includes(name))) tracks.delete(old);
        tracks.set(key, track = new Track(names));
      }
      if (head.k === "window") track.replace(columns, n);
      else { look(names, columns, n); track.append(columns, n); }
      state.now = Math.max(state.now, columns[0][n - 1]);
    }
    if (head.k === "window") { pause(true); const to = state.now; group.whole = [to - 60, to]; group.show(to - 60, to, "full"); }
    else state.dirty = true;
  }

  const trackOf = name => { for (const t of tracks.values()) if (t.members.includes(name)) return t; return null; };
  const empty = new Float64Array(0);

  /* ---- trigger ---- */

  function look(names, columns, n) {
    const t = state.trigger;
    if (!t || t.edge === "event" || (state.held !== null && (t.single || columns[0][n - 1] < state.held + state.span))) return;
    const at = names.indexOf(t.on);
    if (at < 0) return;
    const y = columns[at + 1];
    for (let i = 0; i < n; i++) {
      const before = i ? y[i - 1] : t.last;
      if (before !== undefined && (t.edge === "up" ? before < t.level && y[i] >= t.level : before > t.level && y[i] <= t.level)) { hold(columns[0][i]); break; }
    }
    t.last = y[n - 1];
  }
  function hold(x) { state.held = x; group.a = x; }
  function arm() {
    const on = $("trigger-on").value.trim();
    if (state.trigger || !on) { state.trigger = state.held = null; group.clear(); }
    else state.trigger = { on, edge: $("trigger-edge").value, level: +$("trigger-level").value, single: $("trigger-single").checked };
    $("trigger").classList.toggle("on", !!state.trigger);
    $("trigger").textContent = state.trigger ? "Armed" : "Arm";
    subscribe();
  }

  /* ---- scopes ---- */

  const mm = { scale: 1e3 };
  const line = (signal, label, colour, more) => ({ label, colour, kind: "line", signal, scale: 1, x: empty, y: empty, ...more });
  const LINES = [["injector left", "left"], ["injector right", "right"], ["spark left", "left"], ["spark right", "right"],
    ["intake left", "valve"], ["exhaust left", "valve"], ["intake right", "valve"], ["exhaust right", "valve"]];
  const MODES = ["off", "motor", "generator"], MODE_INK = { motor: "motoring", generator: "generating" };
  const pulseSignals = ["pulse_count", "mode", ...["channel", "open_t_ns", "duration_ns"].flatMap(f => [0, 1, 2, 3].map(i => `pulse_${f}.${i}`))]
    .map(f => "controller.actuator." + f);

  function position() {
    const head = state.info.head_mm;
    return { title: "Piston position", y: "x  [mm]", series: [line("plant.truth.x_m", "position", "motion", mm)],
      high: head * 1.05, low: -head * 1.05, height: 230 };
  }
  function tdc() {
    const stroke = f => "controller.stroke." + f;
    const dots = (label, side, shape) => ({ label, colour: label, kind: "points", shape, x: empty, y: empty,
      signal: stroke("tdc_m"), scale: 1e3, only: [stroke("side"), side] });
    const spec = { title: "Top dead centre", y: "TDC  [mm]", needs: [stroke("side")], height: 200, series: [
      { label: "± 0.1 mm", colour: "band", kind: "area", step: true, signal: stroke("tdc_ref_m"), scale: 1e3, x: empty, y: empty, y2: empty, around: 0.1 },
      line(stroke("tdc_ref_m"), "set point", "wanted", { scale: 1e3, kind: "steps", dash: true, width: 1 }),
      dots("left", 0, "circle"), dots("right", 1, "square")] };
    return spec;
  }
  function pressureVolume() {
    const half = state.info.head_mm * 0.1, area = state.info.area_cm2;
    const loop = (side, sign) => ({ label: side, colour: side, kind: "curve", x: empty, y: empty, signal: `plant.sensor.p_${side}_pa`,
      scale: 1e-5, against: "plant.sensor.x_m", width: side === "left" ? 2.4 : 1.2,
      volume: x => area * (half + sign * x * 100) });
    return { title: "Pressure and volume", x: "V  [cm³]", y: "p  [bar]", square: true, needs: ["plant.sensor.x_m"], low: 0, height: 230,
      series: [loop("left", 1), loop("right", -1)], extent: [0, 2 * half * area * 1.02] };
  }
  function timing() {
    return { title: "TTL lines and modes", y: "", needs: pulseSignals, series: [], lanes: [], pulses: true, bare: true, low: 0, high: 1, height: 90 };
  }
  function lateness() {
    return { title: "Tick lateness", y: "late  [µs]", height: 200, series: [line("plant.timing.late_us", "plant", "plant"), line("controller.timing.late_us", "controller", "controller", { fromLeast: true })] };
  }
  function fuel() {
    return { title: "Fuel and speed", y: "m  [mg]", height: 200, series: [line("controller.stroke.fuel_kg", "fuel", "motion", { scale: 1e6, kind: "steps" })] };
  }
  const HUES = ["motion", "after", "band", "spark", "p-term", "i-term", "valve", "law4"];
  function free(names) {
    const known = new Map(state.info.signals.map(s => [s.name, s]));
    const found = names.map(n => n.trim()).filter(n => known.has(n));
    if (!found.length) return null;
    const units = [...new Set(found.map(n => known.get(n).unit))].join(", ");
    return { title: found.map(n => n.split(".").slice(-1)[0]).join(", "), y: `[${units}]`, height: 200,
      series: found.map((n, i) => line(n, found.length > 1 || n.length < 40 ? n : n.split(".").slice(1).join("."), HUES[i % 8],
        { kind: n.includes(".stroke.") || n.includes("mode") ? "steps" : "line" })) };
  }

  function addScope(spec) {
    if (!spec) return;
    spec.x = spec.x || "t  [s]";
    spec.extent = spec.extent || [0, state.span];
    const host = $("scopes").appendChild(document.createElement("figure"));
    const plot = new Plots.Plot(host, spec, spec.square ? new Plots.Group() : group);
    const close = host.appendChild(document.createElement("button"));
    close.className = "close"; close.textContent = "×"; close.title = "close";
    close.onclick = () => { scopes.splice(scopes.indexOf(plot), 1); plot.remove(); host.remove(); subscribe(); };
    scopes.push(plot);
    subscribe();
    remember();
  }

  const wanted = () => [...new Set([...scopes.flatMap(p => [...(p.spec.needs || []), ...p.spec.series.map(s => s.signal)]),
    ...(state.trigger && state.trigger.edge !== "event" ? [state.trigger.on] : [])])];
  function subscribe() {
    const names = wanted();
    if (state.shown === names.join()) return;
    state.shown = names.join();
    tracks.clear();
    send({ do: "show", signals: names });
  }
  function remember() {
    const own = scopes.filter(p => p.spec.own).map(p => p.spec.series.map(s => s.signal));
    try { localStorage.setItem("scopes", JSON.stringify(own)); } catch { /* a browser without a memory */ }
  }

  /* Give each series of a scope the arrays it now has. */
  function fill(plot) {
    for (const s of plot.spec.series) {
      const track = trackOf(s.signal);
      if (!track) continue;
      const y = track.y(s.signal), x = track.x();
      if (s.against) fillLoop(s, track, x, y);
      else if (s.only) pick(s, x, y, track.y(s.only[0]));
      else { s.x = x; s.y = scaled(y, s.scale); if (s.fromLeast) s.y = aboveLeast(s.y); if (s.around) { s.y2 = s.y.map(v => v + s.around); s.y = s.y.map(v => v - s.around); } }
    }
    if (plot.spec.pulses) plot.spec.lanes = lanes();
  }
  /* A process that is driven by samples has no deadline: its lateness counts from the earliest. */
  const aboveLeast = y => { let least = Infinity; for (const v of y) least = Math.min(least, v); return y.map(v => v - least); };
  const scaled = (y, k) => k === 1 ? y : y.map(v => v * k);
  function pick(s, x, y, side) {
    const at = []; for (let i = 0; i < x.length; i++) if (side[i] === s.only[1]) at.push(i);
    s.x = Float64Array.from(at, i => x[i]); s.y = Float64Array.from(at, i => y[i] * s.scale);
  }
  function fillLoop(s, track, x, y) {
    const [min, max] = group.range || [0, 0], from = Math.max(Plots.place(x, Math.max(min, max - 0.25)), 0), to = Plots.place(x, max);
    s.x = Float64Array.from(track.y(s.against).subarray(from, to), s.volume);
    s.y = Float64Array.from(y.subarray(from, to), v => v * s.scale);
  }

  /* Pulses that acted: a newer one replaces what is not yet due. */
  function lanes() {
    const track = trackOf("controller.actuator.pulse_count");
    const rows = LINES.map(() => []), modes = [];
    if (track) {
      const f = name => track.y("controller.actuator." + name), t = track.x(), count = f("pulse_count"), mode = f("mode");
      const fields = [0, 1, 2, 3].map(i => [f("pulse_channel." + i), f("pulse_open_t_ns." + i), f("pulse_duration_ns." + i)]);
      for (let k = Plots.place(t, (group.range || [0])[0] - 0.1); k < t.length; k++) {
        if (!modes.length || modes[modes.length - 1].mode !== mode[k]) modes.push({ from: t[k], mode: mode[k] });
        for (let i = 0; i < count[k]; i++) {
          const [channel, open, long] = fields[i].map(c => c[k]), row = rows[channel], last = row && row[row.length - 1];
          if (!row) continue;
          const pulse = { open: open * 1e-9, close: (open + long) * 1e-9 };
          if (last && (last.open === pulse.open || last.open > t[k])) row[row.length - 1] = pulse; else row.push(pulse);
        }
      }
    }
    const found = rows.flatMap((row, i) => row.length ? [{ label: LINES[i][0], colour: LINES[i][1],
      from: row.map(p => p.open), to: row.map(p => p.close) }] : []);
    const strip = (label, list, names, inks) => ({ label, labels: list.map(m => names(m)), colours: list.map(m => inks(m)),
      from: list.map(m => m.from), to: list.map((m, i) => i + 1 < list.length ? list[i + 1].from : state.now + 1) });
    if (modes.length) found.push(strip("machine", modes, m => MODES[m.mode] || String(m.mode), m => MODE_INK[MODES[m.mode]] || "off"));
    if (state.modes.length) found.push(strip("mode", state.modes, m => m.name, m => m.name));
    return found;
  }

  /* ---- each frame of the screen ---- */

  function draw() {
    requestAnimationFrame(draw);
    if (!state.dirty || state.paused || document.hidden) return;
    state.dirty = false; state.frames++;
    const to = state.held === null ? state.now : state.held + 0.8 * state.span;
    group.range = [to - state.span, to];
    for (const plot of scopes) {
      const lanesBefore = (plot.spec.lanes || []).length;
      fill(plot);
      if ((plot.spec.lanes || []).length !== lanesBefore) plot.fit(true);
      if (plot.spec.square) plot.look(...plot.spec.extent);
    }
    group.show(to - state.span, to, "live");
  }
  function pause(on) {
    state.paused = on;
    group.whole = [state.now - 60, state.now];
    $("pause").classList.toggle("on", on);
    $("pause").textContent = on ? "Go on" : "Pause";
    if (!on) { state.shown = null; subscribe(); }
  }
  group.heard.push((min, max, by) => { if (by === "user" || by === "whole") { if (!state.paused) pause(true); scopes.forEach(p => { fill(p); if (p.spec.square) p.look(...p.spec.extent); }); } });

  /* ---- words ---- */

  function send(message) { if (socket && socket.readyState === 1) socket.send(JSON.stringify(message)); }
  function ask(message) { const id = ++state.asked; send({ ...message, id }); pending.set(id, performance.now()); return id; }

  const heard = {
    hello(m) {
      state.info = { ...m.engine, signals: m.signals };
      $("name").textContent = m.engine.name;
      document.title = m.engine.name + " · panel";
      $("facts").textContent = [m.engine.model, m.engine.link, m.engine.clock, m.engine.rate_hz + " Hz"].join(" · ");
      $("signals").replaceChildren(...m.signals.map(s => { const o = document.createElement("option"); o.value = s.name; o.label = `${s.unit} ${s.meaning}`; return o; }));
      state.parameters = m.parameters; state.commands = m.commands; state.steerable = m.steerable;
      for (const b of document.querySelectorAll("[data-order]")) b.hidden = !m.commands.some(c => c.kind === b.dataset.order);
      parameterForm(); faultForms();
      if (!scopes.length) {
        [position, tdc, pressureVolume, timing, lateness, fuel].forEach(make => addScope(make()));
        let own = []; try { own = JSON.parse(localStorage.getItem("scopes") || "[]"); } catch { own = []; }
        own.forEach(names => { const spec = free(names); if (spec) addScope({ ...spec, own: true }); });
      } else { state.shown = null; subscribe(); }
      steer();
      document.documentElement.dataset.ready = Math.round(performance.now());
    },
    who(m) {
      state.you = m.you; state.steering = m.steers === m.you; state.steers = m.steers;
      $("viewers").textContent = `${m.you}` + (m.steers ? (state.steering ? ", steering" : `; ${m.steers} steers`) : "; nobody steers") + ` · ${m.viewers.length} looking on`;
      steer();
    },
    status(m) {
      const c = m.controller || {}, p = m.plant || {}, cells = [];
      const cell = (name, value, unit, digits) => { if (value !== undefined && value !== null) cells.push(`${name} <b>${value.toFixed(digits)}</b> ${unit}`); };
      cell("t", c.t_s ?? p.t_s, "s", 1); cell("TDC", c.tdc_mm ?? p.tdc_mm, "mm", 3); cell("of", c.tdc_ref_mm, "mm", 3);
      cell("fuel", c.fuel_mg, "mg", 3); cell("load", c.load_n_s_m, "N s/m", 0); cell("late", p.late_us, "µs", 0);
      cell("at most", p.late_max_us, "µs", 0); cell("missed", p.missed, "", 0); cell("bus ≤", m.bus === null ? null : 100 * m.bus, "%", 1);
      if (m.lost) cells.push(`view lost <b>${m.lost}</b> B`);
      $("readout").innerHTML = cells.map(c => `<span>${c}</span>`).join("");
      document.body.classList.toggle("gone", m.present.length === 0);
      if (m.present.length === 0) $("asked").textContent = "nothing is recorded at present";
      if (c.mode) mode(c.mode);
    },
    words(m) {
      for (const w of m.words) {
        if (w.code.startsWith("mode ")) { mode(w.code.slice(5), w.t_s); state.turned = w; why(); }
        if (w.code === "order" && /^(start|stop|emergency)/.test(w.text)) { state.ordered = w; why(); }
        if (state.trigger && state.trigger.edge === "event" && w.code.startsWith(state.trigger.on) && !(state.held !== null && state.trigger.single)) hold(w.t_s);
        if (/^(mark|disturbance|mode |misfire|parameters|contact|safe)/.test(w.code)) note(w);
      }
      for (const plot of scopes) if (plot.spec.marks && plot.spec.marks.length > 200) plot.spec.marks.splice(0, 100);
      list($("events"), m.words.slice(-200).map(w => [w.severity, `${w.t_s.toFixed(3)}`, `${w.source} ${w.code}`, w.text]), 300);
    },
    values(m) { state.values = m.values; $("undo").disabled = !m.undoable || !state.steering; showValues(); },
    answer(m) {
      const ms = pending.has(m.id) && m.by === state.you ? ` (${Math.round(performance.now() - pending.get(m.id))} ms)` : "";
      pending.delete(m.id);
      list($("answers"), [[m.taken ? "taken" : "refused", m.tick === null ? "" : `tick ${m.tick}`, m.asked,
        `${m.taken ? "taken" : "refused"}: ${m.text} · ${m.by}${ms}`]], 60);
      if (m.by === state.you && m.taken) { state.edits.clear(); showValues(); }
    },
    verdict(m) {
      const box = $("verdict"), items = m.expectations.map(e => `<li class="${e.met ? "yes" : "no"}"></li>`).join("");
      box.innerHTML = `<ul>${items}</ul><p></p>`;
      m.expectations.forEach((e, i) => { box.querySelectorAll("li")[i].textContent = `${e.name}: ${e.text}`; });
      box.querySelector("p").textContent = m.verdict ? `${m.verdict}: the run has ended${m.exit_reason ? ", " + m.exit_reason : ""}`
        : m.expectations.length ? `so far, to ${m.t_s.toFixed(1)} s` : "no expectations";
    },
    begun() { tracks.clear(); state.modes = []; state.turned = state.ordered = null; state.now = 0; state.held = null; for (const p of scopes) p.spec.marks = []; },
  };

  /* Say why the mode is what it is, and who asked for it: order and mode are told in either order. */
  function why() {
    if (!state.turned) return;
    const by = /requested|emergency/.test(state.turned.text) && state.ordered ? `: ${state.ordered.text}` : "";
    $("asked").textContent = state.turned.text + by;
  }

  /* Mark an event in the scopes, but not again and again. */
  function note(w) {
    const label = w.code === "mark" ? w.text : w.code === "disturbance" ? w.text.replace(" begins", "") : w.code;
    for (const plot of scopes) {
      if (plot.spec.square) continue;
      const marks = plot.spec.marks ||= [];
      if (!marks.some(m => m.label === label && Math.abs(m.x - w.t_s) < 0.2)) marks.push({ x: w.t_s, label, colour: w.severity === "info" ? "wanted" : "event" });
    }
  }

  function mode(name, t) {
    if (state.mode === name && t === undefined) return;
    const at = t ?? state.now;
    if (!state.modes.length || state.modes[state.modes.length - 1].name !== name) state.modes.push({ from: state.modes.length ? at : Math.min(at, state.now - 60), name });
    if (state.modes.length > 200) state.modes.shift();
    state.mode = name;
    $("mode").textContent = name; $("mode").className = "badge " + name;
  }

  function list(host, rows, most) {
    for (const [kind, time, head, text] of rows) {
      const item = document.createElement("li");
      item.className = kind;
      item.innerHTML = "<time></time><b></b> <span></span>";
      item.children[0].textContent = time; item.children[1].textContent = head; item.children[2].textContent = text;
      host.prepend(item);
    }
    while (host.children.length > most) host.lastChild.remove();
  }

  /* ---- forms ---- */

  function input(spec, value) {
    if (spec.choices && spec.choices.length) {
      const box = document.createElement("select");
      for (const name of spec.choices) box.add(new Option(name, name));
      if (value !== undefined && value !== null) box.value = value;
      return box;
    }
    const box = document.createElement("input");
    if (spec.low !== undefined && spec.low !== null || /number/.test(spec.kind || "")) { box.type = "number"; box.step = spec.whole || spec.kind === "whole number" ? 1 : "any"; }
    if (spec.kind === "boolean") box.type = "checkbox";
    if (spec.low !== null && spec.low !== undefined) box.min = spec.low;
    if (spec.high !== null && spec.high !== undefined) box.max = spec.high;
    if (value !== undefined && value !== null) { if (box.type === "checkbox") box.checked = !!value; else box.value = value; }
    return box;
  }
  const read = box => box.type === "checkbox" ? box.checked : box.type === "number" ? (box.value === "" ? null : +box.value) : box.value;

  function parameterForm() {
    const rows = state.parameters.map(p => {
      const row = document.createElement("label"), box = input(p, state.values[p.key] ?? p.default);
      row.innerHTML = "<span></span>";
      row.children[0].textContent = p.key;
      row.title = `${p.meaning}; accepted: ${p.accepted || p.kind}`;
      row.dataset.key = p.key;
      const unit = document.createElement("small"); unit.textContent = p.unit;
      row.append(box, unit);
      box.oninput = () => {
        const value = read(box);
        if (value === null || value === state.values[p.key]) state.edits.delete(p.key); else state.edits.set(p.key, value);
        box.classList.toggle("changed", state.edits.has(p.key));
        steer();
      };
      box.onkeydown = e => { if (e.key === "Enter") apply(); };
      return row;
    });
    $("parameters").replaceChildren(...rows);
    narrow();
  }
  function narrow() {
    const part = $("filter").value.trim();
    for (const row of $("parameters").children) row.hidden = !row.dataset.key.includes(part) || (!state.edits.has(row.dataset.key) && !part && !(row.dataset.key in state.values));
  }
  function showValues() {
    for (const row of $("parameters").children) {
      const box = row.children[1], key = row.dataset.key;
      if (state.edits.has(key)) continue;
      box.classList.remove("changed");
      if (key in state.values && document.activeElement !== box) { if (box.type === "checkbox") box.checked = !!state.values[key]; else box.value = state.values[key] ?? ""; }
    }
    narrow(); steer();
  }
  function apply() {
    if (!state.edits.size || !state.steering) return;
    ask({ do: "set", values: Object.fromEntries(state.edits) });
  }

  const ASIDE = ["start", "stop", "emergency-stop", "mark", "set", "get"];
  function faultForms() {
    const cards = state.commands.filter(c => !ASIDE.includes(c.kind)).map(c => {
      const card = document.createElement("div");
      card.className = "fault-card";
      card.innerHTML = "<div><details><summary><b></b> <small></small></summary><form></form></details><button></button></div>";
      card.querySelector("b").textContent = c.kind;
      card.querySelector("small").textContent = c.meaning;
      const boxes = c.fields.map(f => {
        const row = document.createElement("label"), box = input(f, f.default);
        row.innerHTML = "<span></span>"; row.children[0].textContent = f.name.replaceAll("_", " ");
        row.title = `${f.meaning}; accepted: ${f.accepted}${f.optional ? ", or nothing" : ""}`;
        const unit = document.createElement("small"); unit.textContent = f.unit || "";
        if (f.name === "duration_s" && box.value === "") box.value = 0.1;
        row.append(box, unit);
        card.querySelector("form").append(row);
        return [f, box];
      });
      card.querySelector("form").onsubmit = e => e.preventDefault();
      const button = card.querySelector("button");
      button.textContent = c.to === "plant" ? "Inject" : "Send";
      button.dataset.kind = c.kind;
      button.onclick = () => {
        const given = boxes.map(([f, box]) => [f.name, read(box)]).filter(([, v]) => v !== null && v !== "");
        ask({ do: "order", command: { kind: c.kind, ...Object.fromEntries(given) } });
      };
      return card;
    });
    $("faults").replaceChildren(...cards);
  }

  function steer() {
    const on = state.steering && state.steerable;
    for (const b of document.querySelectorAll("#faults button, [data-order='start'], #put-mark, #parameters input, #parameters select")) b.disabled = !on;
    $("apply").disabled = !on || !state.edits.size;
    $("apply").textContent = state.edits.size > 1 ? `Apply ${state.edits.size}` : "Apply";
    $("undo").disabled = $("undo").disabled || !on;
    $("wheel").disabled = state.steerable === false;
    $("wheel").textContent = state.steering ? "Let go" : state.steers ? "Take over" : "Steer";
    $("wheel").classList.toggle("on", state.steering);
  }

  function order(kind) { ask({ do: "order", command: { kind } }); }
  function urgent() { order(state.commands && state.commands.some(c => c.kind === "emergency-stop") ? "emergency-stop" : "stop"); }

  function listen() {
    for (const b of document.querySelectorAll("[data-order]")) b.onclick = () => order(b.dataset.order);
    $("wheel").onclick = () => {
      const force = !!state.steers && !state.steering;
      if (!force || confirm(`${state.steers} steers. Take over?`)) send({ do: "wheel", wanted: !state.steering, force });
    };
    $("pause").onclick = () => pause(!state.paused);
    $("span").onchange = () => { state.span = +$("span").value; state.dirty = true; };
    $("full").onclick = () => ask({ do: "window", signals: wanted(), from: Math.max(state.now - 60, 0), to: 1e12 });
    $("trigger").onclick = arm;
    $("apply").onclick = apply;
    $("undo").onclick = () => ask({ do: "undo" });
    $("filter").oninput = narrow;
    $("put-mark").onclick = () => { if ($("mark").value.trim()) { ask({ do: "order", command: { kind: "mark", text: $("mark").value.trim() } }); $("mark").value = ""; } };
    $("mark").onkeydown = e => { if (e.key === "Enter") $("put-mark").click(); };
    $("add-scope").onclick = () => { const spec = free($("add").value.split(",")); if (spec) { addScope({ ...spec, own: true }); $("add").value = ""; } };
    $("add").onkeydown = e => { if (e.key === "Enter") $("add-scope").click(); };
    for (const b of document.querySelectorAll("[data-zoom]")) b.onclick = () => ({ out: () => group.zoom(2), in: () => group.zoom(0.5), left: () => group.move(-0.5), right: () => group.move(0.5) })[b.dataset.zoom]();
    document.onkeydown = e => {
      if (e.key === "Escape") urgent();
      else if (e.key === " " && !/INPUT|SELECT|BUTTON/.test(document.activeElement.tagName)) { e.preventDefault(); pause(!state.paused); }
    };
  }

  function connect() {
    socket = new WebSocket(socketAddress());
    socket.binaryType = "arraybuffer";
    socket.onmessage = ({ data }) => { if (typeof data === "string") { const m = JSON.parse(data); if (heard[m.k]) heard[m.k](m); } else take(data); };
    socket.onclose = () => { document.body.classList.add("gone"); $("viewers").textContent = "not connected"; setTimeout(connect, 1000); };
    socket.onopen = () => document.body.classList.remove("gone");
  }

  listen(); connect(); requestAnimationFrame(draw);
  return { state, scopes, tracks, group, ask, send, trackOf };
})();
