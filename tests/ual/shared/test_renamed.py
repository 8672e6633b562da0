"""Old public names work for one release, and warn."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from ual import routes
from ual.conformance.flight import Tolerances
from ual.network.lost_links import LostLinks
from ual.shared.renamed import renamed, renamed_property


@dataclass
class Sized:
    """A class with an old name for each kind of member."""

    size_m: float = 2.0

    @property
    def width_m(self) -> float:
        """Its width."""
        return self.size_m

    def grow(self, by_m: float) -> float:
        """Returns the new size."""
        self.size_m += by_m
        return self.size_m

    broad_m = renamed_property(width_m, "Sized.broad_m")
    extend = renamed(grow, "Sized.extend")


def test_an_old_name_does_the_same_and_warns() -> None:
    sized = Sized()
    with pytest.warns(DeprecationWarning, match=r"Sized.extend is grow since 0.3"):
        assert sized.extend(1.5) == 3.5
    with pytest.warns(DeprecationWarning, match=r"Sized.broad_m is width_m since 0.3"):
        assert sized.broad_m == 3.5


def test_old_public_names_work() -> None:
    with pytest.warns(DeprecationWarning, match="parse_waypoints"):
        assert routes.parse_lines("0,0,3\n", "points") == routes.parse_waypoints("0,0,3\n", "points")
    with pytest.warns(DeprecationWarning, match="drift_m"):
        assert Tolerances().way_m == Tolerances().drift_m
    with pytest.warns(DeprecationWarning, match="keep"):
        LostLinks(lambda: ()).look()
