"""What both notations share: a cursor over tokens with recovery, conditions, durations, changes, resources, properties."""
