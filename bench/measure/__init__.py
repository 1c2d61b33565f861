"""What this machine and this code can hold: latency, cost, endurance."""
