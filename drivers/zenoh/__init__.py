"""Link and channels over Zenoh."""
