"""Parts of a proof: compressed where they are found, put together byte by byte."""

import functools
import random
import zlib
from concurrent.futures import ThreadPoolExecutor

import pytest
from proof_tools import bytes_of

from enumsol import Proof, enumerate_roots, gallery
from enumsol.proof.proof_file import MAGIC
from enumsol.proof.writer import BEGIN, FLUSH_EVERY, LAST, BegunProof, Part, ProofWriter, checksum, encoded
from enumsol.search import setup


def text_of(data):
    """The lines in a proof file; zlib compares its checksum."""
    return zlib.decompress(data[len(MAGIC) : -32]).decode().splitlines()


def some_lines(random, most):
    return [encoded(["x", random.randbytes(random.randrange(400)).hex()]) for _ in range(random.randint(1, most))]


def test_parts_stand_in_any_order():
    source = random.Random(1)
    groups = [some_lines(source, most) for most in (1, 3, 1000, 2, 1, 700)]
    parts = [Part.of(lines) for lines in groups]
    assert max(part.size for part in parts) > 2**17
    for _ in range(10):
        order = source.sample(range(len(parts)), len(parts))
        end = LAST + functools.reduce(checksum, (parts[k] for k in order), 1).to_bytes(4, "big")
        stream = BEGIN + b"".join(parts[k].data for k in order) + end
        assert zlib.decompress(stream).decode().splitlines() == [line for k in order for line in groups[k]]
    with pytest.raises(zlib.error, match="incorrect data check"):
        zlib.decompress(BEGIN + parts[0].data + end)
    assert zlib.decompress(BEGIN + LAST + (1).to_bytes(4, "big")) == b""


@pytest.mark.parametrize("seed", range(3))
def test_records_and_parts_come_in_the_order_in_which_they_are_written(tmp_path, seed):
    source = random.Random(seed)
    for path in (None, tmp_path / "x.proof"):
        writer, expected = ProofWriter(path), []
        for _ in range(12):
            if source.random() < 0.5:
                lines = some_lines(source, 100)
                writer.add(Part.of(lines))
                expected += lines
            for _ in range(source.randrange(2 * FLUSH_EVERY)):
                record = ["u", source.random(), 'a "reason" \N{DEGREE SIGN}']
                writer.write(record)
                expected.append(encoded(record))
        proof = writer.close()
        proof.check_integrity()
        assert text_of(bytes_of(proof)) == expected
        assert [encoded(record) for record in Proof(bytes_of(proof)).records()] == expected


def test_a_file_that_was_cut_short_is_read_up_to_its_last_part_at_least(tmp_path):
    source = random.Random(7)
    writer, ends, path = ProofWriter(), [], tmp_path / "cut.proof"
    writer.write({"format": "enumsol-proof"})
    groups = [some_lines(source, 40) for _ in range(20)]
    for lines in groups:
        writer.add(Part.of(lines))
        ends.append(len(writer._file.getvalue()))
    data, expected = bytes_of(writer.close()), [line for lines in groups for line in lines]
    for cut in (*ends, *(source.randrange(ends[0], len(data)) for _ in range(40))):
        path.write_bytes(data[:cut])
        found = [encoded(record) for record in BegunProof(path).records()]
        assert found == expected[: len(found)]
        assert len(found) >= sum(len(lines) for lines, end in zip(groups, ends, strict=True) if end <= cut)


def test_what_is_not_finite_is_no_record():
    with pytest.raises(ValueError, match="not JSON compliant"):
        encoded(["r", [float("inf")]])


def test_what_workers_have_compressed_is_in_the_proof_byte_by_byte(monkeypatch):
    monkeypatch.setattr(setup, "NODES", 64)
    entry = gallery.get("wedge-14-5")
    answers = []

    class Watched(ThreadPoolExecutor):
        def submit(self, function, /, *arguments):
            future = super().submit(function, *arguments)
            future.add_done_callback(lambda done: answers.append(done.result()))
            return future

    with Watched(2) as executor:
        proof = enumerate_roots(entry.build(), entry.alpha, executor=executor).proof
    data = bytes_of(proof)
    parts = [answer.found[-1] for answer in answers if answer is not None]
    assert len(parts) > 8
    assert all(part.data in data for part in parts)
    # the rest are those nodes that were examined here, the header and the footer
    assert sum(len(part.data) for part in parts) > 0.8 * len(data)
