#!/bin/sh
# Installs bathyfleet from the files beside this script, without internet: sh install.sh [FOLDER]
# FOLDER is /opt/bathyfleet unless given; PYTHON names the interpreter. Run it again to upgrade.
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
