"""Touchstone: touches and images of a data-generation service, as NumPy batches.

    import touchstone

    client = touchstone.connect("127.0.0.1:50051")
    for batch in client.dataset(["lat00", "lat20"], touchstone.sphere(step_angle_deg=5), samples=100_000, seed=1):
        print(batch["object"], batch["descriptor_us"])

`touchstone.torch` has the PyTorch dataset; it is imported on its own, since PyTorch is optional.
"""

import pkgutil

# touchstone.training is a distribution of its own, with libraries that streaming does not need.
__path__ = pkgutil.extend_path(__path__, __name__)

from .batch import Batch, Columns, EncodedImages
from .box_touches import box_touches
from .client import Client, connect
from .credentials import Credentials
from .dataset import Dataset, Header
from .errors import (
    InvalidRequest,
    NotFound,
    Refused,
    SourceChanged,
    SourceFailed,
    SourceUnreachable,
    TouchstoneError,
)
from .evidence import Mesh
from .images import Camera, ImageOptions, image
from .lease import Lease
from .measurements import Row, read_plan, write_measurements
from .models import Description, Effect, Model, ObjectInfo, Parameter
from .permutation import Permutation
from .plans import FacesPlan, SpherePlan, Touches, faces, sphere, touches
from .report import Report
from .report_parts import ComparedValue, DataReport, Detectable, Explanation, Quality, Sessions, Step, UncertaintyBudget, Value, Versus
from .rig import Rig, TouchCheck
from .samples import Samples
from .session import Session, touch_id
from .tabular import Rows, Tabular
from .version import __version__

__all__ = [
    "Batch", "Camera", "Client", "Columns", "ComparedValue", "Credentials", "DataReport", "Dataset", "Description", "Detectable", "Effect",
    "EncodedImages", "Explanation", "FacesPlan", "Header", "ImageOptions", "InvalidRequest", "Lease", "Mesh", "Model",
    "NotFound", "ObjectInfo", "Parameter", "Permutation", "Quality", "Refused", "Report", "Rig", "Row", "Rows", "Samples",
    "Session", "Sessions", "SourceChanged", "SourceFailed", "SourceUnreachable", "SpherePlan", "Step", "Tabular", "TouchCheck", "Touches",
    "TouchstoneError", "UncertaintyBudget", "Value", "Versus", "__version__", "box_touches", "connect", "faces", "image", "read_plan",
    "sphere", "touch_id", "touches", "write_measurements",
]
