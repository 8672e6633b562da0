"""Code that follows from the contract: ``make proto`` writes the modules of this package."""
