from wholebody.motion.batch import BatchProgress as BatchProgress, avoid_many as avoid_many, read_many as read_many
from wholebody.motion.batch_table import AvoidedCase as AvoidedCase
from wholebody.motion.bisection.method import Bisection as Bisection
from wholebody.motion.checking import ClipCheck as ClipCheck
from wholebody.motion.clip_torques import Torques as Torques, torques as torques
from wholebody.motion.judging import AvoidanceReport as AvoidanceReport, Avoided as Avoided
from wholebody.motion.measures import MotionBounds as MotionBounds
from wholebody.motion.reading import posed as posed, read_skeleton as read_skeleton
from wholebody.motion.resting_hands import RestingHands as RestingHands
from wholebody.motion.retargeting import bone_errors as bone_errors
from wholebody.motion.skeleton import SkeletonMotion as SkeletonMotion
from wholebody.motion.stance import StanceFeet as StanceFeet
from wholebody.motion.standing_ground import Ground as Ground, ground as ground
from wholebody.motion.streaming import Retargeter as Retargeter
from wholebody.figures.strength import Strength as Strength
from wholebody.motion.trajectory.method import Trajectory as Trajectory
from wholebody.motion.worn_equipment import Equipment as Equipment, equipment as equipment
