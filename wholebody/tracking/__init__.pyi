from wholebody.tracking.drag import Drag as Drag
from wholebody.tracking.dragging import (
    Dragged as Dragged,
    DragJudgement as DragJudgement,
    drag_along as drag_along,
    judge_drag as judge_drag,
)
from wholebody.tracking.frame import Frame as Frame
from wholebody.tracking.loop import FrameLoop as FrameLoop, follow as follow
from wholebody.tracking.path_following import (
    circle as circle,
    follow_path as follow_path,
    read_path as read_path,
    spread as spread,
)
from wholebody.tracking.recording import Judgement as Judgement, Recording as Recording, judge as judge
from wholebody.tracking.scenes import (
    build_scene as build_scene,
    gallery as gallery,
)
