"""Analysis of recorded signals: spectra, contacts, decay, Hilbert-Huang."""
