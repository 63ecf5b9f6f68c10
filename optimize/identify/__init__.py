"""What are the fence and the parcel made of? Parameters from recordings of impacts."""

from .job import main as main
