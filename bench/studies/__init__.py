"""Many runs and models side by side: bounds, gains, comparisons, campaigns."""
