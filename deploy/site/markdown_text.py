"""Text of programs as Markdown."""
import re


def escaped(text: str) -> str:
    """`text` with what Markdown would take for mark-up made literal; what stands in backticks stays code."""
    parts = re.split(r"(`[^`\n]+`)", text)
    return "".join(part if i % 2 else re.sub(r"([\\*_\[\]<>#|])", r"\\\1", part) for i, part in enumerate(parts))


def cell(text: str) -> str:
    """The same within a row of a table."""
    parts = re.split(r"(`[^`\n]+`)", text.replace("\n", " "))
    return "".join(part.replace("|", "\\|") if i % 2 else escaped(part) for i, part in enumerate(parts))
