"""Link through shared memory."""
