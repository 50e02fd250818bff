#!/bin/sh
# Installs bathyfleet from the files beside this script, without internet: sh install.sh [FOLDER]
# FOLDER is /opt/bathyfleet unless given; PYTHON names the interpreter. Run it again to upgrade. WITHOUT names packages of
# the version before that are to be left out. STATE is the folder of the service's settings, DEFAULTS its variables.
set -eu

folder=${1:-/opt/bathyfleet}
python=${PYTHON:-python@PYTHON@}
here=$(CDPATH= cd -- "$(dirname -- "$0")" && pwd)
cd "$here"

fail() {
  echo "install.sh: $*" >&2
  exit 1
}

[ "$(uname -s)-$(uname -m)" = "Linux-@MACHINE@" ] || fail "these files are for Linux on @MACHINE@, this is $(uname -s) on $(uname -m)"
command -v "$python" >/dev/null || fail "there is no $python: install Python @PYTHON@, or name it by PYTHON=..."
found=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
[ "$found" = "@PYTHON@" ] || fail "these files are for Python @PYTHON@, $python is $found"

sha256sum --check --quiet --strict SHA256SUMS || fail "a file is damaged or missing: copy the whole file again"
case $(uname -m)-$(getconf GNU_LIBC_VERSION 2>/dev/null || echo none) in
*-none) fail "the C library is not glibc, which these files need" ;;
esac

# Made anew beside the old one, which stays in use until the new one is complete.
new=$folder.new
rm -rf "$new"
mkdir -p "$(dirname "$folder")"
"$python" -m venv --without-pip "$new" || fail "no virtual environment could be made: on Debian install python@PYTHON@-venv"
# pip from its own wheel. Every file has to be the one of requirements.txt.
PYTHONPATH=$(echo "$here"/wheels/pip-*.whl) PIP_DISABLE_PIP_VERSION_CHECK=1 "$new/bin/python" -m pip install \
  --quiet --isolated --no-index --no-cache-dir --find-links "$here/wheels" --require-hashes --requirement requirements.txt
if [ -e "$folder/bin/python" ]; then
  # Packages that were put in beside the program, such as those for object stores: it may not start without them.
  cat >"$new/packages.py" <<'EOF'
import re
import sys
from importlib.metadata import distributions

def called(name):
    return re.sub(r"[-_.]+", "-", name).lower()

needs = {called(one.metadata["Name"]): one.requires or [] for one in distributions()}
# What the program itself needs may be another thing in another version.
left, own = [(called(sys.argv[1]), ())], set()
while left:
    name, extras = left.pop()
    if (name, extras) in own or name not in needs:
        continue
    own.add((name, extras))
    for need in needs[name]:
        words, _, marker = need.partition(";")
        found = re.match(r"\s*([A-Za-z0-9._-]+)\s*(?:\[([^]]*)\])?", words)
        if "extra" not in marker or any(f'"{one}"' in marker or f"'{one}'" in marker for one in extras):
            left.append((called(found[1]), tuple(sorted(e.strip() for e in (found[2] or "").split(",") if e.strip()))))
base = {name for name, _ in own} | {"pip", "setuptools", "wheel"}
print("\n".join(sorted(needs if sys.argv[2:] == ["all"] else needs.keys() - base)))
EOF
  added=$(PYTHONPATH= "$folder/bin/python" -I "$new/packages.py" "@NAME@") || fail "the packages in $folder cannot be read"
  there=$(PYTHONPATH= "$new/bin/python" -I "$new/packages.py" "@NAME@" all)
  missing=
  for name in $added; do
    case " $(echo $there ${WITHOUT:-}) " in
    *" $name "*) ;;
    *) missing="$missing $name" ;;
    esac
  done
  rm "$new/packages.py"
  [ -z "$missing" ] || fail "$folder has packages that these files lack:$missing. Nothing was changed. Make the files anew with --extra or --with for them, or leave them out: WITHOUT=\"${missing# }\""
fi
if [ -n "@CHECK@" ] && [ -d "${STATE:-/var/lib/@COMMAND@}" ]; then
  # With what the service itself is started with. Variables are lines as systemd reads them, no script.
  PYTHONPATH= "$new/bin/python" - "${STATE:-/var/lib/@COMMAND@}" "${DEFAULTS:-/etc/default/@COMMAND@}" "$new/bin/@COMMAND@" @CHECK@ <<'EOF' || fail "the new version cannot use the settings, see above. Nothing was changed"
import os
import pathlib
import subprocess
import sys

state, defaults, command = sys.argv[1:4]
variables = dict(os.environ)
if pathlib.Path(defaults).is_file():
    for line in pathlib.Path(defaults).read_text().splitlines():
        name, equals, value = line.strip().partition("=")
        if equals and not name.startswith(("#", ";")):
            value = value.strip()
            variables[name.strip()] = value[1:-1] if value[:1] in ("'", '"') and value[-1:] == value[:1] else value
sys.exit(subprocess.run([command, *sys.argv[4:]], cwd=state, env=variables).returncode)
EOF
fi
# Its programs name the folder that they were made in.
PYTHONPATH= "$new/bin/python" - "$new" "$folder" <<'EOF'
import pathlib
import sys

made, used = sys.argv[1:]
for path in pathlib.Path(made).rglob("*"):
    if path.is_symlink() or not path.is_file() or path.suffix == ".pyc":
        continue
    data = path.read_bytes()
    if path.parent.name == "bin" or path.name == "pyvenv.cfg":
        path.write_bytes(data.replace(made.encode(), used.encode()))
    elif path.parent.name == "system":
        path.write_bytes(data.replace(b"/opt/bathyfleet", used.encode()))
EOF
if [ -e "$folder" ]; then
  rm -rf "$folder.old"
  mv "$folder" "$folder.old"
fi
mv "$new" "$folder"
"$folder/bin/@COMMAND@" --version >/dev/null || fail "it was installed and does not start: $folder/bin/@COMMAND@ --version"
echo "@NAME@ @VERSION@ is in $folder$([ -e "$folder.old" ] && echo ", the version before in $folder.old")"
