"""The measures, one in each module. A round measures each way once, in random order."""
