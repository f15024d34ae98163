"""What learning runs on: threads, device, compiled kernels, optimisers."""
