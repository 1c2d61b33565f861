"""The bench's shared vocabulary: messages, codec, time, configuration, ports. Imports nothing of ours."""
