"""The hooks of the skills, a module a skillset: the only code that a skill needs besides its model."""
