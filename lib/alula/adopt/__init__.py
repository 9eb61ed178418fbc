"""Robots from trees of others: actions become skills, conditions resources, trees missions; ``alula new robot DIR --from-trees FOLDER``."""
