"""Periodic motions of a case: followed from event to event with their tangent, solved for, proved."""
