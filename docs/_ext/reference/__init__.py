"""The sections of the reference that are made from the code when the site is built.

Each module but `directive` and `markdown` returns those of one page as Markdown, by `page()`;
`directive` lays them there.
"""
