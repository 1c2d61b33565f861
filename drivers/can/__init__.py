"""Link over a CAN bus, whatever carries its frames."""
