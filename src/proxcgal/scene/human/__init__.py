"""Virtual operators: articulated bodies of capsules that walk, turn and reach on a timeline."""
