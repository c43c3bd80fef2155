"""The discretised problem: fields, elements, laws, plate, friction, magnet, assembly."""
