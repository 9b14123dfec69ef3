"""Identification: which rub, if any, is behind a measured vibration, as a posterior distribution."""
