"""Cases whose speed changes: pieces of constant speed under a law of speed or a drive."""
