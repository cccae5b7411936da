from .posting import Posted as Posted
from .posting import post as post
