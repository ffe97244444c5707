"""Contact sheets: pictures in rows, each under its caption. Needs Pillow."""

from __future__ import annotations

from pathlib import Path

from PIL import Image, ImageDraw

CAPTION = 14
# What a letter of Pillow's own font is wide.
LETTER = 6


class Sheet:
    """Pictures in rows of `columns`, each in a tile of this many pixels under its caption."""

    def __init__(self, tile: tuple[int, int] = (400, 225), columns: int = 4) -> None:
        self.tile, self.columns = tile, columns
        self.tiles: list[tuple[str, Image.Image]] = []

    def add(self, caption: str, picture: Path | Image.Image | None) -> None:
        """A picture of any size. Where it is transparent, the tile is white; without one the tile
        is grey.
        """
        tile = Image.new("RGB", self.tile, "white" if picture else "lightgrey")
        if picture:
            image = picture if isinstance(picture, Image.Image) else Image.open(picture)
            image = image.convert("RGBA")
            image.thumbnail(self.tile)
            if (larger := min(self.tile[0] // image.width, self.tile[1] // image.height)) > 1:
                image = image.resize(
                    (image.width * larger, image.height * larger), Image.Resampling.NEAREST
                )
            place = (self.tile[0] - image.width) // 2, (self.tile[1] - image.height) // 2
            tile.paste(image, place, image)
        self.tiles.append((caption[: self.tile[0] // LETTER], tile))

    def save(self, path: Path, rows: int | None = None) -> None:
        """Writes `path`, or where there are more than `rows` rows several files, numbered."""
        each = rows * self.columns if rows else len(self.tiles)
        parts = [self.tiles[at : at + each] for at in range(0, len(self.tiles), each or 1)]
        for number, tiles in enumerate(parts):
            name = path if len(parts) == 1 else path.with_stem(f"{path.stem}-{number + 1:02}")
            self._draw(tiles).save(name)
            print(f"{name}: {len(tiles)} pictures")

    def _draw(self, tiles: list[tuple[str, Image.Image]]) -> Image.Image:
        width, height = self.tile[0], self.tile[1] + CAPTION
        sheet = Image.new(
            "RGB", (self.columns * width, -(-len(tiles) // self.columns) * height), "white"
        )
        draw = ImageDraw.Draw(sheet)
        for number, (caption, tile) in enumerate(tiles):
            x, y = number % self.columns * width, number // self.columns * height
            draw.text((x + 3, y + 1), caption, fill="black")
            sheet.paste(tile, (x, y + CAPTION))
        return sheet
