"""Who may do what over a network, by the common name of its certificate: Zenoh's access control.

Every process of an engine holds to the same rules, against everybody else: a controller takes
samples from the plant alone and commands from operators alone, an operator believes only these two.
Links that stay in this machine are open to whoever may open them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

from drivers.zenoh.sockets import ZenohSection

if TYPE_CHECKING:
    from hil.config.process import RolesConfig

_SPEAK: Final = ("put", "delete")
_ASK: Final = ("put", "query")
_SERVE: Final = ("declare_subscriber", "declare_queryable", "reply")
_BE_THERE: Final = ("liveliness_token",)
_LISTEN: Final = ("declare_subscriber",)
_LOOK: Final = ("liveliness_query", "declare_liveliness_subscriber")


class Right(NamedTuple):
    """What may come from whom, on which keys of the engine."""

    roles: tuple[str, ...]
    messages: tuple[str, ...]
    keys: tuple[str, ...]


RIGHTS: Final = (
    Right(("plant",), _SPEAK, ("frames/plant", "status/plant")),
    Right(("plant",), _BE_THERE, ("alive/plant/**", "alive/pair/**")),
    Right(("controller",), _SPEAK, ("frames/controller", "status/controller")),
    Right(("controller",), _BE_THERE, ("alive/controller/**", "alive/ready/**")),
    Right(("plant", "controller"), _LISTEN, ("frames/*",)),
    Right(("plant", "controller"), _SERVE, ("command", "stop")),
    Right(("operator",), _ASK, ("command", "stop")),
    Right(("operator", "observer"), _LISTEN, ("status/*",)),
    Right(("operator", "observer"), _BE_THERE, ("alive/bench/**",)),
)
"""What a process takes in; what it tells is the other side of the same."""

_TOLD: Final = (
    Right(("plant", "controller"), (*_SPEAK, *_LISTEN, *_BE_THERE), ("frames/*", "alive/**")),
    Right(("operator", "observer"), (*_SPEAK, *_BE_THERE), ("status/*", "alive/**")),
    Right(("operator",), (*_SERVE, *_ASK), ("command", "stop")),
    Right(("plant", "controller"), (*_ASK, *_LISTEN), ("command", "stop", "status/*")),
)


def access_control(config: ZenohSection) -> dict[str, object]:
    """Return the part of a session's configuration; none without certificates."""
    if config.tls is None:
        return {}
    taken = [_rule(config, f"takes-{n}", "ingress", right) for n, right in enumerate(RIGHTS)]
    told = [_rule(config, f"tells-{n}", "egress", right) for n, right in enumerate(_TOLD)]
    looks = {
        "id": "looks", "permission": "allow", "flows": ["ingress", "egress"],
        "messages": list(_LOOK), "key_exprs": ["hil/*/alive/**"],
    }  # fmt: skip
    local = {
        "id": "local", "permission": "allow", "flows": ["ingress", "egress"],
        "messages": [*_SPEAK, *_ASK[1:], *_SERVE, *_BE_THERE, *_LOOK], "key_exprs": ["**"],
    }  # fmt: skip
    return {
        "access_control": {
            "enabled": True,
            "default_permission": "deny",
            "rules": [*taken, *told, looks, local],
            "subjects": [*_subjects(config.tls.roles), _THIS_MACHINE],
            "policies": [*_policies((*RIGHTS, *_TOLD), [*taken, *told]), *_FOR_ALL],
        }
    }


_THIS_MACHINE: Final = {"id": "this-machine", "link_protocols": ["unixsock-stream", "tcp"]}
_FOR_ALL: Final = (
    {"rules": ["looks"], "subjects": ["plant", "controller", "operator", "observer"]},
    {"rules": ["local"], "subjects": ["this-machine"]},
)


def _rule(config: ZenohSection, name: str, flow: str, right: Right) -> dict[str, object]:
    return {
        "id": name, "permission": "allow", "flows": [flow], "messages": list(right.messages),
        "key_exprs": [f"hil/{config.engine}/{key}" for key in right.keys],
    }  # fmt: skip


def _subjects(roles: RolesConfig) -> list[dict[str, object]]:
    names: Mapping[str, Sequence[str]] = roles.model_dump()
    return [
        {"id": role, "link_protocols": ["tls"], "cert_common_names": list(common)}
        for role, common in names.items()
    ]


def _policies(
    rights: Sequence[Right], rules: Sequence[Mapping[str, object]]
) -> list[dict[str, object]]:
    return [
        {"rules": [rule["id"]], "subjects": list(right.roles)}
        for right, rule in zip(rights, rules, strict=True)
    ]
