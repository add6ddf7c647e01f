"""URScript, the language of Universal Robots' controllers."""

from kerfpath.post.languages import Language
from kerfpath.post.urscript.reader import read
from kerfpath.post.urscript.writer import URScript as URScript
from kerfpath.post.urscript.writer import URScriptSettings as URScriptSettings
from kerfpath.post.urscript.writer import check, inherited, is_reserved, rules

URSCRIPT = Language(
    name="urscript",
    title="URScript",
    manufacturers=("Universal Robots",),
    families=("ur",),
    suffix=".script",
    settings=URScriptSettings,
    rules=rules,
    formatter=URScript,
    is_reserved=is_reserved,
    check=check,
    assumed={"laser_output": 0},
    inherited=inherited,
    read=read,
)
"""The language as registered."""
