from tolcontact.assembly import *
