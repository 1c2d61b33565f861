"""The shared vocabulary: messages, codec, time, configuration, ports. Imports nothing of ours."""

from hil import compiled as _compiled

_compiled.use()
