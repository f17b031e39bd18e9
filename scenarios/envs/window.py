"""The window of the render mode `human`, by pygame as in Gymnasium's own environments."""

from typing import Any

import numpy as np
from gymnasium.error import DependencyNotInstalled, Error

from scenarios.video import Picture


class Window:
    """Shows pictures at the rate at which they were taken.

    Args:
        title: of the window.
        rate_hz: pictures a second at most.

    Raises:
        gymnasium.error.DependencyNotInstalled: pygame is missing.
    """

    def __init__(self, title: str, rate_hz: float) -> None:
        try:
            import pygame
        except ImportError as error:
            raise DependencyNotInstalled(
                "render_mode='human' needs pygame: pip install pygame, or use render_mode='rgb_array'"
            ) from error
        self._pygame, self._title, self._rate_hz = pygame, title, rate_hz
        self._clock = pygame.time.Clock()
        self._surface: Any = None

    def show(self, picture: Picture) -> None:
        """Show a picture (H, W, 3), and wait until it is time for it.

        Raises:
            gymnasium.error.Error: there is no display.
        """
        pygame = self._pygame
        if self._surface is None:
            try:
                pygame.display.init()
                self._surface = pygame.display.set_mode(picture.shape[1::-1])
            except pygame.error as error:
                raise Error(f"render_mode='human' needs a display ({error}); use render_mode='rgb_array'") from error
            pygame.display.set_caption(self._title)
        pygame.event.pump()
        self._surface.blit(pygame.surfarray.make_surface(np.swapaxes(picture, 0, 1)), (0, 0))
        pygame.display.flip()
        self._clock.tick(self._rate_hz)

    def close(self) -> None:
        """Close the window."""
        self._pygame.display.quit()
        self._surface = None
