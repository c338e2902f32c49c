"""Relaxations that are pruned in floats and not in balls: smaller multipliers prove most of them."""

from proof_tools import bytes_of

from enumsol import enumerate_roots, gallery, verify
from enumsol.search.nodes import Relaxations


def test_multipliers_that_are_too_large_for_balls_are_replaced_by_smaller_ones(monkeypatch):
    problem, answers, fallen_back = gallery.clip(12, 1), [], Relaxations.fallen_back

    def recorded(self, codes, failed):
        answers.append(fallen_back(self, codes, failed))
        return answers[-1]

    monkeypatch.setattr(Relaxations, "fallen_back", recorded)
    found = enumerate_roots(problem, 3.0, max_nodes=6000)
    assert len(answers) > 10
    assert sum(answer is not None and answer.pruned for answer in answers) > 0.6 * len(answers)
    assert found.stats.fallback_qps == 0
    assert found.stats.escalations.refined > 10
    # the exclusions hold for a checker, too
    assert verify(problem, found.proof).ok
    assert bytes_of(enumerate_roots(problem, 3.0, max_nodes=6000).proof) == bytes_of(found.proof)
