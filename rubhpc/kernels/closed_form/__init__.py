"""Closed form: a case from event to event, with what is measured, followed and filled for it."""
