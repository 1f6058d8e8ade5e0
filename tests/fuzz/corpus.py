"""The inputs that fuzzing keeps: corpus/READER.tar.xz of each reader holds READER/INPUT.

The same inputs give the same archive: they are sorted, and their times, owners and modes are fixed. To look at them:
tar xf tests/fuzz/corpus/READER.tar.xz; every build unpacks all of them into its tests/fuzz/corpus."""
import io
import lzma
import os
import pathlib
import shutil
import tarfile

ARCHIVES = pathlib.Path(__file__).resolve().parent / "corpus"
SUFFIX = ".tar.xz"


def readers(archives=ARCHIVES):
    return sorted(path.name.removesuffix(SUFFIX) for path in archives.glob("*" + SUFFIX))


def read(reader, archives=ARCHIVES):
    """The bytes of every input, by name; empty if there is no archive."""
    path = archives / (reader + SUFFIX)
    if not path.exists():
        return {}
    with tarfile.open(path) as archive:
        return {pathlib.PurePosixPath(member.name).name: archive.extractfile(member).read() for member in archive if member.isfile()}


def tar_of(reader, inputs):
    """The same bytes for the same inputs."""
    tar = io.BytesIO()
    with tarfile.open(fileobj=tar, mode="w", format=tarfile.USTAR_FORMAT) as archive:
        for name in sorted(inputs):
            member = tarfile.TarInfo(f"{reader}/{name}")  # time 0, owner 0, mode 0644
            member.size = len(inputs[name])
            archive.addfile(member, io.BytesIO(inputs[name]))
    return tar.getvalue()


def write(reader, inputs, archives=ARCHIVES):
    """Replaces the archive of `reader`."""
    path = archives / (reader + SUFFIX)
    draft = path.with_suffix(".new")
    draft.write_bytes(lzma.compress(tar_of(reader, inputs), preset=9 | lzma.PRESET_EXTREME))
    os.replace(draft, path)


def unpack(reader, folder, archives=ARCHIVES):
    """Makes `folder` hold the inputs of `reader` and nothing else."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name, content in read(reader, archives).items():
        (folder / name).write_bytes(content)


def pack(reader, folder, archives=ARCHIVES):
    """Makes the archive of `reader` hold the files of `folder` and nothing else."""
    write(reader, {path.name: path.read_bytes() for path in folder.iterdir()}, archives)


def add(reader, files, archives=ARCHIVES):
    """Adds files under their names; ValueError if a name or a content is there already. Returns how many inputs there are."""
    inputs = read(reader, archives)
    for path in map(pathlib.Path, files):
        content = path.read_bytes()
        if path.name in inputs:
            raise ValueError(f"{path}: an input of {reader} is named so already")
        same = next((name for name, known in inputs.items() if known == content), None)
        if same is not None:
            raise ValueError(f"{path}: is the input {same} of {reader}")
        inputs[path.name] = content
    write(reader, inputs, archives)
    return len(inputs)
