"""The report of a store: one page to open in a browser, whole in a file or served case by case."""
