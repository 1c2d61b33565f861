"""Clock, real-time privileges, process and service: what the operating system gives."""
