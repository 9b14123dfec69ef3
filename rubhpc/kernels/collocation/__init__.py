"""Contact with any smooth gap and any law: contact forces as polynomials on Lobatto's nodes."""
