"""The pieces of `optimize.reproduce_paper`: the paper's fences, runs, statements and figures."""
