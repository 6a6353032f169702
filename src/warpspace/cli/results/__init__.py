"""What commands say of a result: printed, as JSON and as CSV."""
