"""Parts of the work-precision measurement: scenes, ladder, errors, times, fronts and what is drawn
and written of them."""
