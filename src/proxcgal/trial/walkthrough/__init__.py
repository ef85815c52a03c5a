"""Walk-through programming: a hand guides the arm, a guard watches, what was taught is played."""
