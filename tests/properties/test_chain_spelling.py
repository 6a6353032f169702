"""Kinematic chains survive writing and reading, in every accepted spelling."""

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chains import chains
from warpspace.exceptions import ChainError
from warpspace.machine.description import Chain, parse_chain

FILLERS = st.text(alphabet=" ()[]{}'’′-_\t", max_size=3)


@given(chain=chains())
def test_canonical_spelling_reads_back(chain: Chain) -> None:
    assert parse_chain(str(chain)) == chain


@given(chain=chains(), frame=st.sampled_from("Fb"), data=st.data())
def test_brackets_primes_blanks_and_hyphens_change_nothing(
    chain: Chain, frame: str, data: st.DataObject
) -> None:
    letters = str(chain).replace("F", frame)
    spelling = "".join(data.draw(FILLERS) + letter for letter in letters) + data.draw(FILLERS)
    assert parse_chain(spelling) == chain


@given(text=st.text(alphabet="wtFbXYZABCxyzDW T-'()", max_size=14))
def test_any_text_is_a_chain_that_reads_back_or_a_chain_error(text: str) -> None:
    with suppress(ChainError):
        chain = parse_chain(text)
        assert parse_chain(str(chain)) == chain
        assert 1 <= len(chain.axes) <= 6
        return
    with pytest.raises(ChainError, match="expected") as caught:
        parse_chain(text)
    assert repr(text) in str(caught.value)
