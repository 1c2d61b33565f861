"""What crosses a link, declared once: messages, codec, protection, pulses, commands, status."""
