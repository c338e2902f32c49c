"""The tree search over the statuses, at one alpha and over an interval."""
