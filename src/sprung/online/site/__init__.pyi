from sprung.online.site.accounts import Role as Role
from sprung.online.site.accounts import add_account as add_account
from sprung.online.site.accounts import add_token as add_token
from sprung.online.site.accounts import remove_account as remove_account
from sprung.online.site.accounts import remove_token as remove_token
from sprung.online.site.app import Server as Server
from sprung.online.site.app import application as application
from sprung.online.site.shared import Context as Context
