"""Entry points of the public API that use several rooms; `alula` exports them."""
