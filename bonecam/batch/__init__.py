"""Many parts: what a batch consists of (`parts`), the work on one (`one_part`), the run of all (`run`) in processes of
this computer, on an executor of the caller's, or on a cluster (`cluster`)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
