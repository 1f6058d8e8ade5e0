"""Pages of the Python package: the docstrings of what it exports."""
import griffe

import repository

# Every name of touchstone.__all__ stands on one page.
PAGES = {
    "Connecting": ["connect", "Client", "Credentials", "Description", "ObjectInfo", "Lease"],
    "Plans and touches": ["sphere", "faces", "touches", "box_touches", "SpherePlan", "FacesPlan", "Touches", "read_plan"],
    "Photographs": ["image", "ImageOptions", "Camera", "EncodedImages"],
    "Datasets": ["Dataset", "Header", "Samples", "Permutation", "Batch", "Columns"],
    "Models and effects": ["Model", "Effect", "Parameter", "Mesh"],
    "Reports": ["Report", "DataReport", "Explanation", "Step", "Value", "Quality", "ComparedValue", "Versus", "Sessions", "Detectable",
                "UncertaintyBudget", "Rows", "Tabular"],
    "Measured sets": ["Session", "Row", "write_measurements", "touch_id"],
    "Rigs": ["Rig", "TouchCheck"],
    "Errors": ["TouchstoneError", "InvalidRequest", "NotFound", "Refused", "SourceUnreachable", "SourceChanged", "SourceFailed"],
}
# Modules that are imported on their own.
MODULES = {"touchstone.torch": "PyTorch", "touchstone.torch_samples": "PyTorch, samples by index", "touchstone.loader": "Loader that resumes",
           "touchstone.ray": "Ray", "touchstone.gym": "Gymnasium", "touchstone.formats": "Formats of other tools", "touchstone.mcap": "MCAP"}


def pages(made: dict[str, str]) -> list:
    """Adds the pages; returns their navigation. A name that no page has, or without a docstring, is an error."""
    package = griffe.load("touchstone", search_paths=[repository.ROOT / "client/python"], resolve_aliases=True)
    exported = {name for name in package.exports if not name.startswith("__")}
    listed = [name for names in PAGES.values() for name in names]
    bare = [place for name in listed for place in undocumented(package, name)]
    bare += [place for module in MODULES for place in undocumented(package, module.removeprefix("touchstone."))]
    for wrong, what in ((exported - set(listed), "on no page"), (set(listed) - exported, "not in touchstone.__all__"),
                        (set(bare), "without a docstring")):
        if wrong:
            raise SystemExit(f"deploy/site/python_reference.py: {', '.join(sorted(wrong))}: {what}")
    navigation = []
    for title, names in PAGES.items():
        path = f"python/{title.lower().replace(' ', '-')}.md"
        made[path] = f"# {title}\n\n" + "\n\n".join(f"::: {found(package, name).path}\n    options:\n      heading: touchstone.{name}"
                                                    for name in names)
        navigation.append({title: path})
    for module, title in MODULES.items():
        path = f"python/{module}.md"
        made[path] = (f"# {module}\n\n::: {module}\n    options:\n      heading_level: 2\n      show_root_heading: false\n"
                      "      show_root_toc_entry: false\n")
        navigation.append({title: path})
    return navigation


def found(package, name):
    """What a name of the package means: a function hides the module that it comes from."""
    one = package[name].final_target if package[name].is_alias else package[name]
    return one[name] if one.is_module and name in package.exports else one


def undocumented(package, name):
    """The functions, classes and properties of a name that have no docstring."""
    one = found(package, name)
    names = one.exports if one.is_module else None
    if not one.has_docstring:
        yield one.path
    for member in one.all_members.values() if one.is_class or one.is_module else ():
        shown = member.name in names if names is not None else not (member.name.startswith("_") or member.is_alias)
        if not shown or member.name in ("from_proto", "to_proto") or not (member.is_function or member.is_class or "property" in member.labels):
            continue
        if member.is_class:
            yield from undocumented(package, member.path.removeprefix("touchstone."))
        elif not member.has_docstring:
            yield member.path
