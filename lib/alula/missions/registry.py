"""All types of node that a robot's missions may be made of: to tick, to check, to draw, for editors."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from alula.missions.context import MissionContext
from alula.missions.nodes import mission_nodes
from alula.missions.part import MissionPart
from alula.missions.pending import PendingInterrupts
from alula.missions.skills import Crew, robot_nodes
from alula.model.model import Skillset
from alula.trees import nav2
from alula.trees.attributes import type_name
from alula.trees.document import Element
from alula.trees.errors import Problem
from alula.trees.node import name_in_files
from alula.trees.node_type import Category, NodeType
from alula.trees.reading import TreeFiles
from alula.trees.registry import NodeRegistry
from alula.trees.standard import standard_registry


def mission_registry(skillsets: Sequence[Skillset], part: MissionPart, crew: Crew | None = None) -> NodeRegistry:
    """Return BehaviorTree.CPP's nodes, Alula's, the robot's own, its skills and resources; without a crew the last can't be ticked."""
    return _with_robot(standard_registry() | mission_nodes(_context(crew)), skillsets, part, crew)


def registry_of(
    files: TreeFiles, skillsets: Sequence[Skillset], part: MissionPart, crew: Crew | None = None, more: Iterable[NodeType] = ()
) -> NodeRegistry:
    """Return the types that the trees of files may have: those of `mission_registry`, Nav2's, and what the files, or ``more``, declare.

    A declaration gives way to a class of that name, and one of the files to what Nav2 declares; but where it tells of another node than one
    of Alula's or Nav2's, it is the file's own.
    """
    given = {one.name: one for one in more}
    types = {**given, **{one.name: one for one in files.declared()}}
    own = {name_in_files(node) for node in part.nodes}
    known = [one for one in nav2.registry_for(files.trees.values()) if one.name not in own and not _is_another(types.get(one.name), one)]
    types.update({one.name: nav2.told_of(given[one.name], one) if one.name in given and not one.is_tickable else one for one in known})
    types.update({one.name: one for one in mission_nodes(_context(crew)) if not _is_another(types.get(one.name), one)})
    types.update({one.name: one for one in standard_registry()})
    return _with_robot(NodeRegistry(types.values()), skillsets, part, crew)


def _context(crew: Crew | None) -> MissionContext:
    return MissionContext(clock_ns=int, pending=PendingInterrupts(int)) if crew is None else crew.context


def _with_robot(registry: NodeRegistry, skillsets: Sequence[Skillset], part: MissionPart, crew: Crew | None) -> NodeRegistry:
    registry = registry | robot_nodes(skillsets, crew)
    for node in part.nodes:
        registry.register(node)
    return registry


def _is_another(declared: NodeType | None, known: NodeType) -> bool:
    """Return whether a declaration is of another node: of another category, or with ports that this one has not."""
    if declared is None:
        return False
    ports = ((port, known.ports.get(port.name)) for port in declared.ports.values())
    return declared.category is not known.category or any(mine is None or mine.direction is not port.direction for port, mine in ports)


def without_class(files: TreeFiles, registry: NodeRegistry) -> dict[str, Element]:
    """Return the nodes that the files, or Nav2, declare and no class makes, by their names, each where it is used first."""
    found: dict[str, Element] = {}
    for tree in files.trees.values():
        for top in tree.children:
            for element in top.iterate():
                known = registry.get(type_name(element))
                if element.tag != Category.SUBTREE.value and known is not None and (known.assumed or known is files.models.get(known.name)):
                    found.setdefault(known.name, element)
    return found


def no_class(files: TreeFiles, registry: NodeRegistry) -> Problem | None:
    """Return what is to be done about nodes that no class makes, at the first of them; None where there are none."""
    found = without_class(files, registry)
    if not found:
        return None
    first, *others = found
    library = {one.name for one in (*nav2.registry(), *mission_nodes(_context(None))) if one.is_tickable}
    shadowed = [name for name in found if name in library]
    which = f"'{first}'" + (f" and {len(others)} more" if others else "")
    where = "by Nav2" if first not in files.models else "in the file"
    message = f"{which} {'are' if others else 'is'} declared {where}, and no class makes {'them' if others else 'it'}"
    if shadowed:
        message += f" ('{shadowed[0]}' is declared otherwise than the node of that name here, so it is taken for another)"
    return Problem(found[first].place, message, f"write a class for {', '.join(found)} in the robot's part `missions`", "ALU620")
