from .diagnosis import Diagnosis as Diagnosis
from .diagnosis import diagnose as diagnose
from .extracted import ExtractedTMesh as ExtractedTMesh
from .iga import read_iga as read_iga
from .iga import write_iga as write_iga
from .tmesh import TMesh as TMesh
from .tsm import read_tsm as read_tsm
from .tsm import write_tsm as write_tsm
