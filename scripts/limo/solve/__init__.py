"""From mesh to result: attempts, recovery ladder, judge."""
