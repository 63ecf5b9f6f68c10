"""The optimiser against others on problems with known optima that nobody here wrote.

`pytest tests/design/test_optimizer_problems.py --bench DIR` measures how many of them each method
solves over the number of evaluations, and writes `problems.json` and `optimizer_problems.png`.
"""
