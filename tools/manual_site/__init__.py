"""The manual as a site: what MkDocs asks for pages outside of docs/."""
