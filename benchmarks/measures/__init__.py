"""What is measured, one module each. A round measures each way once, in an order of its own."""
