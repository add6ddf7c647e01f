"""URScript, the language of Universal Robots' controllers."""

from kerfpath.post._languages import Language
from kerfpath.post.urscript._check import check, is_reserved
from kerfpath.post.urscript._read import read
from kerfpath.post.urscript._write import URScript as URScript
from kerfpath.post.urscript._write import URScriptSettings as URScriptSettings
from kerfpath.post.urscript._write import rules

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
    read=read,
)
"""The language as registered."""
