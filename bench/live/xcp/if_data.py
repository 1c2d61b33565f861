"""What a calibration tool has to know of the slave itself: IF_DATA XCP of the A2L file.

The A2ML block says what stands in it, as the standard asks; it names no more than is there.
"""

from __future__ import annotations

from typing import Final

from bench.live.ports import HOST
from bench.live.xcp.addresses import STRIDE
from bench.live.xcp.daq import EVENTS
from bench.live.xcp.limits import MAX_CTO, MAX_DTO

_PROTOCOL: Final = 0x0101
_TRANSPORT: Final = 0x0100
_ANSWERED_MS: Final = 2500
"""A parameter's change is answered at the latest after the patience of `hil set`, 2 s."""

_COMMANDS: Final = (
    "GET_COMM_MODE_INFO", "GET_ID", "SET_MTA", "UPLOAD", "SHORT_UPLOAD", "DOWNLOAD",
    "SHORT_DOWNLOAD", "CLEAR_DAQ_LIST", "SET_DAQ_PTR", "WRITE_DAQ", "SET_DAQ_LIST_MODE",
    "GET_DAQ_LIST_MODE", "START_STOP_DAQ_LIST", "START_STOP_SYNCH", "GET_DAQ_CLOCK",
    "GET_DAQ_PROCESSOR_INFO", "GET_DAQ_RESOLUTION_INFO", "GET_DAQ_EVENT_INFO", "FREE_DAQ",
    "ALLOC_DAQ", "ALLOC_ODT", "ALLOC_ODT_ENTRY",
)  # fmt: skip


def a2ml() -> str:
    """Return the block that says what IF_DATA is made of."""
    names = ", ".join(f'"{name}" = {number}' for number, name in enumerate(_COMMANDS))
    return f"""    /begin A2ML
      block "IF_DATA" taggedunion if_data {{
        "XCP" taggedstruct {{
          block "PROTOCOL_LAYER" struct {{
            uint; uint; uint; uint; uint; uint; uint; uint; uchar; uint;
            enum {{ "BYTE_ORDER_MSB_LAST" = 0, "BYTE_ORDER_MSB_FIRST" = 1 }};
            enum {{ "ADDRESS_GRANULARITY_BYTE" = 1 }};
            taggedstruct {{ ("OPTIONAL_CMD" enum {{ {names} }})*; }};
          }};
          block "DAQ" struct {{
            enum {{ "STATIC" = 0, "DYNAMIC" = 1 }}; uint; uint; uchar;
            enum {{ "OPTIMISATION_TYPE_DEFAULT" = 0 }};
            enum {{ "ADDRESS_EXTENSION_FREE" = 0 }};
            enum {{ "IDENTIFICATION_FIELD_TYPE_ABSOLUTE" = 0 }};
            enum {{ "GRANULARITY_ODT_ENTRY_SIZE_DAQ_BYTE" = 1 }}; uchar;
            enum {{ "NO_OVERLOAD_INDICATION" = 0 }};
            taggedstruct {{
              block "TIMESTAMP_SUPPORTED" struct {{
                uint; enum {{ "SIZE_DWORD" = 4 }}; enum {{ "UNIT_1US" = 3 }};
              }};
              (block "EVENT" struct {{
                char[101]; char[9]; uint; enum {{ "DAQ" = 1 }}; uchar; uchar; uchar; uchar;
              }})*;
            }};
          }};
          block "XCP_ON_TCP_IP" struct {{ uint; uint; taggedunion {{ "ADDRESS" char[16]; }}; }};
          block "XCP_ON_UDP_IP" struct {{ uint; uint; taggedunion {{ "ADDRESS" char[16]; }}; }};
        }};
      }};
    /end A2ML"""


def text(port: int) -> str:
    """Return the slave's own description: limits, commands, events, and where it is."""
    commands = "\n".join(f"        OPTIONAL_CMD {name}" for name in _COMMANDS)
    events = "\n".join(_event(number, name) for number, name in enumerate(EVENTS))
    timers = " ".join([str(_ANSWERED_MS)] * 2 + ["0"] * 5)
    media = "\n".join(
        f"      /begin XCP_ON_{medium}_IP {_TRANSPORT:#06x} {port} ADDRESS \"{HOST}\""
        f" /end XCP_ON_{medium}_IP" for medium in ("TCP", "UDP")
    )  # fmt: skip
    return f"""    /begin IF_DATA XCP
      /begin PROTOCOL_LAYER
        {_PROTOCOL:#06x} {timers} {MAX_CTO} {MAX_DTO}
        BYTE_ORDER_MSB_LAST ADDRESS_GRANULARITY_BYTE
{commands}
      /end PROTOCOL_LAYER
      /begin DAQ
        DYNAMIC 0 {len(EVENTS)} 0 OPTIMISATION_TYPE_DEFAULT ADDRESS_EXTENSION_FREE
        IDENTIFICATION_FIELD_TYPE_ABSOLUTE GRANULARITY_ODT_ENTRY_SIZE_DAQ_BYTE {STRIDE}
        NO_OVERLOAD_INDICATION
        /begin TIMESTAMP_SUPPORTED 1 SIZE_DWORD UNIT_1US /end TIMESTAMP_SUPPORTED
{events}
      /end DAQ
{media}
    /end IF_DATA"""


def _event(number: int, name: str) -> str:
    """A channel; its cycle is that of the run, and nought here."""
    shown = f'"every tick of the {name}" "{name[:8]}"'
    return f"        /begin EVENT {shown} {number} DAQ 255 0 0 0 /end EVENT"
