from .job import run

run()
