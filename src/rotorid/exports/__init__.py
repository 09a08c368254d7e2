"""An identified vehicle in the forms that other tools know; what a form cannot express is named, not dropped."""

from rotorid.exports.forms import Exported, export_vehicle

__all__ = ["Exported", "export_vehicle"]
