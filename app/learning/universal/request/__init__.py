"""What one request does with the networks for every size: transfer, or learning from scratch."""
