"""What is flown: one manoeuvre a module."""
