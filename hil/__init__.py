"""The shared vocabulary: messages, codec, time, configuration, ports. Imports nothing of ours."""
