"""Forms of pages: their fields, and who sends them."""

from dataclasses import dataclass
from typing import Annotated
from urllib.parse import parse_qsl

from fastapi import Depends, HTTPException, Request
from fastapi.concurrency import run_in_threadpool

from sprung.online.site.access import CSRF_FIELD, check_csrf_token, find_person
from sprung.online.site.people import Person, Role

#: Largest number of fields of a form.
_MOST_FIELDS = 50


@dataclass(frozen=True, slots=True)
class Form:
    """A form that was sent.

    Parameters
    ----------
    person
        Who sent it.
    fields
        Its fields by name; of several of one name the last.
    """

    person: Person
    fields: dict[str, str]

    def text(self, name: str) -> str:
        """Return a field, without blanks around; empty if it is not there."""
        return self.fields.get(name, "").strip()


class FormOf:
    """Dependency that gives the form of a request, and refuses a person whose role does not include another.

    Parameters
    ----------
    role
        Minimum role.
    """

    def __init__(self, role: Role) -> None:
        self.role = role

    async def __call__(self, request: Request) -> Form:
        """Return the form of a request."""
        fields = await form_fields(request)
        person = await run_in_threadpool(find_person, request)
        if person is None:
            raise HTTPException(401, "log in first")
        if not person.role.includes(self.role):
            raise HTTPException(403, f"this requires the role {self.role}, but {person.name} is {person.role}")
        check_csrf_token(request, person, fields.get(CSRF_FIELD, ""))
        return Form(person, fields)


async def form_fields(request: Request) -> dict[str, str]:
    """Return the fields of a form."""
    try:
        text = (await request.body()).decode()
        return dict(parse_qsl(text, keep_blank_values=True, max_num_fields=_MOST_FIELDS))
    except ValueError:
        raise HTTPException(400, "the form cannot be read: reload the page and try again") from None


ViewerForm = Annotated[Form, Depends(FormOf(Role.VIEWER))]
EngineerForm = Annotated[Form, Depends(FormOf(Role.ENGINEER))]
AdminForm = Annotated[Form, Depends(FormOf(Role.ADMIN))]
